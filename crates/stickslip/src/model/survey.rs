//! What is known of a model before anything is computed: its linear modes with all joints free and with all joints
//! stuck, the motion at which each joint begins to slip, the masses that nothing holds.
//!
//! Free: no joint carries a force. Stuck: every slider stands, so that a joint is its springs, or a constraint if it
//! is rigid. Between the two lie the resonances of the model with friction: springs and constraints only raise the
//! frequency of every mode (Courant, Fischer).

use super::{GROUND, Model, ModelError, System, SystemJoint};
use crate::law::{Law, MOST_DIRECTIONS, RatePoint, Relative, StepPoint};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use num_complex::Complex64;
use std::collections::HashMap;
use std::f64::consts::TAU;
use stickslip_numerics::maximum::maximum;

/// A mode of the linear structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearMode {
    /// Undamped natural frequency, rad/s.
    pub omega: f64,
    /// Damping ratio `φᵀCφ / (2ω φᵀMφ)`: exact where damping does not couple the modes, and to first order where it is
    /// light.
    pub damping: f64,
}

/// The modes of a linear structure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Modes {
    /// Those with a frequency, rising.
    pub elastic: Vec<LinearMode>,
    /// Motions that no spring resists.
    pub rigid: usize,
    /// Modes whose frequency is lost in rounding beside stiffnesses many orders higher.
    pub lost: usize,
}

/// How a joint holds while it is stuck, and when it lets go.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstSlip {
    /// Name of the joint.
    pub joint: String,
    /// Limit of the slider that gives way first, N; zero if the joint carries nothing.
    pub limit: f64,
    /// Relative displacement from the unloaded state at which it gives way, m; `None` if it holds rigidly until the
    /// limit.
    pub displacement: Option<f64>,
    /// Of the direction along which faces press on each other, which opens and closes and never slips: the force with
    /// which they do at rest, N, zero if they are apart. `None` along the others.
    pub pressed: Option<f64>,
}

/// How much of its limit a stuck joint needs under the model's excitation, over a range of drive frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct Onset {
    /// Largest amplitude of the joint's load over its limit. The joint slips where it is above 1; the excitation times
    /// `1 / largest` is the smallest that makes it slip.
    pub largest: f64,
    /// Where that is, rad/s.
    pub at: f64,
    /// The stretches of the range in which it is above 1, rad/s. They hold for a joint that slips first: what the
    /// others do after it has slipped changes the structure.
    pub slips: Vec<(f64, f64)>,
}

/// Masses that no spring holds, as one body that can drift.
#[derive(Debug, Clone, PartialEq)]
pub struct Loose {
    /// Their names.
    pub masses: Vec<String>,
    /// Whether joints that are stuck hold it.
    pub held_by_friction: bool,
}

/// What is known of a model before anything is computed.
#[derive(Debug, Clone)]
pub struct Survey {
    system: System,
    joints: Vec<Stuck>,
    free: Linear,
    stuck: Linear,
    loose: Vec<Loose>,
}

/// A joint while its sliders stand.
#[derive(Debug, Clone, PartialEq)]
struct Stuck {
    /// Which joint of the system, and which of its axes.
    joint: usize,
    axis: usize,
    name: String,
    /// `W`, by its entries.
    at: Vec<(usize, f64)>,
    hold: Hold,
    /// The force that presses the faces at rest, N, of a normal direction.
    pressed: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Hold {
    /// It carries nothing.
    Nothing,
    /// The sum of its springs, N/m; the limit and the displacement of the slider that gives way first.
    Spring {
        stiffness: f64,
        limit: f64,
        displacement: f64,
    },
    Rigid {
        limit: f64,
    },
}

impl Hold {
    /// Along one of the law's axes.
    fn of(law: &dyn Law, axis: usize) -> Hold {
        let Some(branches) = law.sliders() else { return Hold::smooth(law, axis) };
        let branches = || branches.iter().filter(|branch| branch.limit > 0.0);
        let rigid = branches().filter(|branch| branch.stiffness.is_none()).map(|branch| branch.limit);
        if let Some(limit) = rigid.reduce(|a, b| a + b) {
            return Hold::Rigid { limit };
        }
        let springs = || branches().filter_map(|branch| Some((branch.stiffness?, branch.limit)));
        let first = springs().min_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)));
        let stiffness = springs().map(|(stiffness, _)| stiffness).sum();
        first.map_or(Hold::Nothing, |(k, limit)| Hold::Spring { stiffness, limit, displacement: limit / k })
    }

    /// Faces pressed on each other: the spring that they are at rest, which no load makes slip.
    fn pressed(law: &dyn Law, axis: usize) -> Hold {
        let stiffness = small_stiffness(law, axis);
        if stiffness > 0.0 {
            Hold::Spring { stiffness, limit: f64::INFINITY, displacement: f64::INFINITY }
        } else {
            Hold::Nothing
        }
    }

    /// A smooth law: the spring that it is in small motion, or rigid where its resistance is viscous. The steeper its
    /// slope, the nearer it is to that.
    fn smooth(law: &dyn Law, axis: usize) -> Hold {
        let (limit, stiffness) = (law.scale(), small_stiffness(law, axis));
        match (limit > 0.0, stiffness > 0.0) {
            (false, _) => Hold::Nothing,
            // a law of displacement alone holds as the spring that it is, and never gives way
            (true, false) if limit.is_infinite() => Hold::Nothing,
            (true, true) => Hold::Spring { stiffness, limit, displacement: limit / stiffness },
            (true, false) => Hold::Rigid { limit },
        }
    }
}

/// Stiffness in motion that is small in every direction, N/m.
fn small_stiffness(law: &dyn Law, axis: usize) -> f64 {
    // what velocity alone decides is as stiff as the spring before it, however it is regularised
    if let Some(prox) = law.prox() {
        return if prox.compliance() > 0.0 { prox.compliance().recip() } else { 0.0 };
    }
    if law.pieces().is_some() {
        return law.linearised(SMALL, 1.0).re;
    }
    let (count, rest) = (law.directions(), [0.0; MOST_DIRECTIONS]);
    if let Some(step) = law.step() {
        let z = vec![0.0; step.states()];
        let mut point = StepPoint::new(count, z.len());
        step.linearise(count, &rest, &rest, &z, &mut point);
        return point.force_slope(axis)[count + axis];
    }
    let Some(rate) = law.rate() else { return 0.0 };
    // with what the states do at once: f_u + f_z z_v
    let z = vec![0.0; rate.states()];
    let mut point = RatePoint::new(count, z.len());
    rate.linearise(count, &Relative { displacement: rest, velocity: rest }, &z, &mut point);
    let by_states = (0..z.len()).map(|s| point.force_slope(axis)[2 * count + s] * point.rate_slope(s)[count + axis]);
    point.force_slope(axis)[axis] + by_states.sum::<f64>()
}

/// The force along an axis of a law that has not moved, N.
fn force_at_rest(law: &dyn Law, axis: usize) -> f64 {
    let rest = [0.0; MOST_DIRECTIONS];
    match (law.step(), law.rate()) {
        (Some(step), _) => step.value(&rest, &rest, &mut vec![0.0; step.states()])[axis],
        (None, Some(rate)) => {
            let mut z = vec![0.0; rate.states()];
            rate.value(&Relative { displacement: rest, velocity: rest }, &z.clone(), &mut z)[axis]
        }
        (None, None) => 0.0,
    }
}

/// An amplitude (m) so small that no law slips, whose square is still a normal number.
const SMALL: f64 = 1e-150;

/// A spring and damper along a direction of the free places.
struct Link {
    at: Vec<(usize, f64)>,
    stiffness: f64,
    damping: f64,
}

/// A linear structure in modal coordinates.
#[derive(Debug, Clone)]
struct Linear {
    modes: Modes,
    /// Shapes of the elastic modes with `φᵀMφ = 1`, one column each; none if some stiffnesses had to count as rigid.
    shapes: Option<DMatrix<f64>>,
}

/// An eigenvalue below this share of the largest has fewer than six digits left; then the stiffest springs count as
/// rigid for the modes below. Symmetric QR errs by some 1e-15 of the largest.
const FEW_DIGITS: f64 = 1e-9;
/// An eigenvalue below this share of the largest is rounding.
const ROUNDING: f64 = 1e-13;
/// Springs above this share of the stiffest make the modes at the top of the spectrum.
const STIFFEST: f64 = 1e-4;
/// Levels of stiffness that are told apart.
const LEVELS: usize = 4;
/// A pivot below this share of what it came from is zero.
const ZERO: f64 = 1e-12;
/// Degrees of freedom beyond which modes are not computed: they would take longer than a second. Measured: 0.35 s at
/// 500, with the third power.
const LARGEST: usize = 700;
/// Iterations of the eigenvalue search per degree of freedom; a few are needed.
const ITERATIONS: usize = 100;

impl Model {
    /// Surveys the model; the cost is that of two symmetric eigenvalue problems.
    ///
    /// # Errors
    /// [`ModelError`] as [`Model::assemble`].
    ///
    /// # Example
    /// ```
    /// use std::f64::consts::TAU;
    /// let couple = stickslip::model::example::blade_couple();
    /// let survey = couple.survey().unwrap();
    /// // both blades on their springs, and the contact mass on the shroud's spring
    /// assert_eq!(survey.free().elastic.len(), 3);
    /// assert_eq!(survey.stuck().elastic.len(), 2);   // the contact mass rides on blade 1
    /// assert!((survey.free().elastic[1].omega / TAU - 121.25).abs() < 0.001);
    /// ```
    pub fn survey(&self) -> Result<Survey, ModelError> {
        let system = self.assemble()?;
        let index: HashMap<&str, usize> = system.places().iter().enumerate().map(|(i, p)| (p.as_str(), i)).collect();
        let ends = |between: &[String; 2]| -> Vec<(usize, f64)> {
            let ends = between.iter().zip([1.0, -1.0]);
            ends.filter_map(|(name, sign)| Some((*index.get(name.as_str())?, sign))).collect()
        };
        let springs: Vec<Link> = self
            .springs
            .iter()
            .map(|s| Link { at: ends(&s.between), stiffness: s.stiffness, damping: s.damping })
            .filter(|link| !link.at.is_empty())
            .collect();
        let joints: Vec<Stuck> = system.joints().iter().enumerate().flat_map(Stuck::of_joint).collect();
        let mass: Vec<f64> = (0..system.dofs()).map(|i| system.structure().own_mass(i)).collect();
        let loose = self.loose(&joints);
        if system.dofs() > LARGEST {
            let unknown = || Linear { modes: Modes { lost: mass.len(), ..Modes::default() }, shapes: None };
            return Ok(Survey { free: unknown(), stuck: unknown(), system, joints, loose });
        }
        let free = Linear::new(&mass, &springs.iter().collect::<Vec<_>>(), &[]);
        let held: Vec<Link> = joints
            .iter()
            .filter_map(|joint| match joint.hold {
                Hold::Spring { stiffness, .. } => Some(Link { at: joint.at.clone(), stiffness, damping: 0.0 }),
                _ => None,
            })
            .filter(|link| !link.at.is_empty())
            .collect();
        let rigid: Vec<&[(usize, f64)]> = joints
            .iter()
            .filter(|joint| matches!(joint.hold, Hold::Rigid { .. }) && !joint.at.is_empty())
            .map(|joint| joint.at.as_slice())
            .collect();
        let stuck = Linear::new(&mass, &springs.iter().chain(&held).collect::<Vec<_>>(), &rigid);
        Ok(Survey { system, joints, free, stuck, loose })
    }

    /// Bodies of masses that no spring holds to the ground or to a moved place.
    fn loose(&self, joints: &[Stuck]) -> Vec<Loose> {
        let mut index: HashMap<String, usize> = HashMap::from([(GROUND.to_owned(), 0)]);
        for motion in &self.motions {
            index.insert(motion.on.clone(), 0); // moved places are held as the ground is
        }
        let places: Vec<String> = self.masses.iter().flat_map(super::Mass::places).collect();
        for (i, place) in places.iter().enumerate() {
            index.entry(place.clone()).or_insert(i + 1);
        }
        let ends = |between: &[String; 2]| Some((*index.get(&between[0])?, *index.get(&between[1])?));
        let mut bodies = Groups::new(places.len() + 1);
        self.springs.iter().filter(|s| s.stiffness > 0.0).filter_map(|s| ends(&s.between)).for_each(|e| bodies.join(e));
        let mut gripped = bodies.clone();
        let carries = |(i, _): &(usize, &super::Joint)| joints.iter().any(|j| j.joint == *i && j.hold != Hold::Nothing);
        let grips = self.joints.iter().enumerate().filter(carries);
        for (_, joint) in grips {
            // of nodes, each direction
            let along = |name: &String, label: &String| match label.strip_prefix(joint.name.as_str()) {
                Some(rest) if !rest.is_empty() && name != GROUND => format!("{name}{rest}"),
                _ => name.clone(),
            };
            for label in self.joint_labels(joint) {
                let between = [along(&joint.between[0], &label), along(&joint.between[1], &label)];
                if let Some(e) = ends(&between) {
                    gripped.join(e);
                }
            }
        }
        let mut loose: Vec<(usize, Loose)> = Vec::new();
        for place in &places {
            let at = index[place];
            let body = bodies.of(at);
            if body == bodies.of(0) {
                continue;
            }
            match loose.iter_mut().find(|(known, _)| *known == body) {
                Some((_, one)) => one.masses.push(place.clone()),
                None => {
                    let held_by_friction = gripped.of(at) == gripped.of(0);
                    loose.push((body, Loose { masses: vec![place.clone()], held_by_friction }));
                }
            }
        }
        loose.into_iter().map(|(_, one)| one).collect()
    }
}

impl Stuck {
    /// One for each axis of a joint.
    fn of_joint((index, joint): (usize, &SystemJoint)) -> Vec<Self> {
        let axes = joint.labels().zip(joint.axes()).enumerate();
        axes.map(|(axis, (name, along))| {
            let law = &**joint.law();
            let (hold, pressed) = match law.normal() == Some(axis) {
                true => (Hold::pressed(law, axis), Some(force_at_rest(law, axis))),
                false => (Hold::of(law, axis), None),
            };
            Stuck { joint: index, axis, name, at: along.rows().to_vec(), hold, pressed }
        })
        .collect()
    }
}

/// Which of some things hang together.
#[derive(Debug, Clone)]
struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    fn new(count: usize) -> Self {
        Groups { parent: (0..count).collect() }
    }

    /// The lowest member of the group of `i`, or of a group that stands for it.
    fn of(&self, mut i: usize) -> usize {
        while self.parent[i] != i {
            i = self.parent[i];
        }
        i
    }

    fn join(&mut self, (a, b): (usize, usize)) {
        let (a, b) = (self.of(a), self.of(b));
        self.parent[a.max(b)] = a.min(b);
    }
}

impl Linear {
    /// The modes of masses (zero where a place has none) on links, with constraints `Σ w x = 0`.
    fn new(mass: &[f64], links: &[&Link], rigid: &[&[(usize, f64)]]) -> Linear {
        let total = reduced(mass, links, rigid);
        let (elastic, rigid_motions) = (total.elastic(), rigid_motions(mass, links, rigid));
        let dofs = total.frequencies.len();
        let expected = dofs - rigid_motions.min(dofs);
        if elastic.len() >= expected {
            let shapes = total.shapes(expected);
            let lowest = elastic.len() - expected; // rounding may give a rigid motion a frequency
            let modes = Modes { elastic: elastic[lowest..].to_vec(), rigid: rigid_motions, lost: 0 };
            return Linear { modes, shapes: Some(shapes) };
        }
        // some modes are too far below the stiffest springs: those springs count as rigid for them
        let mut high = elastic;
        let (mut links, mut rigid) = (links.to_vec(), rigid.to_vec());
        for _ in 0..LEVELS {
            let stiffest = links.iter().map(|link| link.stiffness).fold(0.0, f64::max);
            let (above, below): (Vec<&Link>, Vec<&Link>) =
                links.iter().partition(|link| link.stiffness > STIFFEST * stiffest);
            if below.is_empty() {
                break;
            }
            rigid.extend(above.iter().map(|link| link.at.as_slice()));
            links = below;
            let lower = reduced(mass, &links, &rigid);
            if lower.frequencies.len() + high.len() != dofs {
                break; // the gap does not come from these springs
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
            // what is above rounding, with the digits that it has
            let mut all = total.above(ROUNDING);
            all.drain(..all.len().saturating_sub(expected));
            if all.len() > high.len() {
                high = all;
            }
        }
        let lost = expected - high.len();
        Linear { modes: Modes { elastic: high, rigid: rigid_motions, lost }, shapes: None }
    }
}

/// Modes of the places with mass: squared frequencies, rising, may be rounding around zero.
struct Reduced {
    frequencies: Vec<f64>,
    damping: Vec<f64>,
    /// `φᵀMφ = 1`, in the places of the model, one column each.
    vectors: DMatrix<f64>,
}

impl Reduced {
    fn above(&self, share: f64) -> Vec<LinearMode> {
        let floor = share * self.frequencies.last().map_or(0.0, |w| w.abs());
        let pairs = self.frequencies.iter().zip(&self.damping).filter(|(w, _)| **w > floor);
        pairs.map(|(w, c)| LinearMode { omega: w.sqrt(), damping: c / (2.0 * w.sqrt()) }).collect()
    }

    fn elastic(&self) -> Vec<LinearMode> {
        self.above(FEW_DIGITS)
    }

    fn shapes(&self, count: usize) -> DMatrix<f64> {
        self.vectors.columns(self.vectors.ncols() - count, count).into_owned()
    }
}

/// Bodies with mass that neither a spring nor a constraint holds to the ground.
fn rigid_motions(mass: &[f64], links: &[&Link], rigid: &[&[(usize, f64)]]) -> usize {
    let n = mass.len();
    let mut groups = Groups::new(n + 1); // place n stands for the ground
    let held = links.iter().filter(|link| link.stiffness > 0.0).map(|link| link.at.as_slice());
    for at in held.chain(rigid.iter().copied()) {
        match at {
            [(a, _)] => groups.join((*a, n)),
            [(a, _), (b, _)] => groups.join((*a, *b)),
            _ => {}
        }
    }
    let ground = groups.of(n);
    let mut bodies: Vec<usize> = (0..n).filter(|i| mass[*i] > 0.0).map(|i| groups.of(i)).collect();
    bodies.sort_unstable();
    bodies.dedup();
    bodies.into_iter().filter(|body| *body != ground).count()
}

/// Eliminates constraints and places without mass, and solves for the modes of the remaining places.
fn reduced(mass: &[f64], links: &[&Link], rigid: &[&[(usize, f64)]]) -> Reduced {
    let n = mass.len();
    // places without mass come first: constraints are to remove these, and the masses that remain stay positive
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|i| mass[*i] > 0.0);
    let basis = Basis::new(n, &order, rigid);
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
    // without an answer every mode is lost
    let unknown =
        || Reduced { frequencies: vec![0.0; heavy], damping: vec![0.0; heavy], vectors: DMatrix::zeros(n, heavy) };
    if heavy == 0 {
        return unknown();
    }
    // L with M = L Lᵀ; its inverse turns the modes into a standard problem
    let Some(inverse) = inverse_root(&m) else { return unknown() };
    let standard = &inverse * k * inverse.transpose();
    let standard = (&standard + standard.transpose()) * 0.5;
    let Some(eigen) = SymmetricEigen::try_new(standard, f64::EPSILON, ITERATIONS * heavy) else {
        return unknown();
    };
    let mut rising: Vec<usize> = (0..heavy).collect();
    rising.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let modal = inverse.transpose() * eigen.eigenvectors;
    let (mut frequencies, mut damping, mut vectors) = (Vec::new(), Vec::new(), DMatrix::zeros(n, heavy));
    for (column, &mode) in rising.iter().enumerate() {
        let shape = modal.column(mode);
        frequencies.push(eigen.eigenvalues[mode]);
        damping.push(shape.dot(&(&c * shape)));
        // places without mass follow from the last to the first
        let mut y = DVector::zeros(r);
        y.rows_mut(light, heavy).copy_from(&shape);
        for p in (0..light).rev() {
            y[p] = -(p + 1..r).map(|j| follow[(p, j)] * y[j]).sum::<f64>();
        }
        for place in 0..n {
            vectors[(place, column)] = basis.rows[place].iter().map(|(j, t)| t * y[*j]).sum();
        }
    }
    Reduced { frequencies, damping, vectors }
}

/// `matrix += value · row rowᵀ`
fn add(matrix: &mut DMatrix<f64>, row: &[(usize, f64)], value: f64) {
    for (i, a) in row {
        for (j, b) in row {
            matrix[(*i, *j)] += value * a * b;
        }
    }
}

/// Removes the first `light` coordinates, which have no mass, from damping and stiffness: they move so that their
/// springs balance. Returns their rows `x_p = -Σ follow[p, j] x_j`, j > p. A coordinate without a spring follows its
/// dampers.
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
        // congruence with x_p = -Σ g_j x_j: only rows and columns that p is tied to change
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

/// `L⁻¹` of `M = L Lᵀ`.
fn inverse_root(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = m.nrows();
    let diagonal = (0..n).all(|i| (0..n).all(|j| i == j || m[(i, j)] == 0.0));
    if diagonal {
        return Some(DMatrix::from_diagonal(&m.diagonal().map(|m| 1.0 / m.sqrt())));
    }
    Cholesky::new(m.clone())?.l().solve_lower_triangular(&DMatrix::identity(n, n))
}

/// Coordinates that fulfil constraints: every place as a sum of the places that are kept.
struct Basis {
    /// The places that are kept, in the order in which they were offered.
    kept: Vec<usize>,
    /// For every place its (coordinate, factor).
    rows: Vec<Vec<(usize, f64)>>,
}

impl Basis {
    fn new(n: usize, order: &[usize], rigid: &[&[(usize, f64)]]) -> Basis {
        let mut a = DMatrix::<f64>::zeros(rigid.len(), n);
        for (row, at) in rigid.iter().enumerate() {
            at.iter().for_each(|(place, w)| a[(row, *place)] += w);
        }
        // Gauss and Jordan; a constraint that follows from others leaves a row of zeros
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
        Basis { kept, rows }
    }

    /// A direction of the places in the coordinates.
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

// ------------------------------------------------------------------------------------------ first slip

/// Complex multiplications that an estimate of first slip may take: about 0.1 s.
const WORK: f64 = 2.5e7;
/// Frequencies of a range that are looked at, beside those around the modes in it.
const FREQUENCIES: usize = 200;
/// Fewer than this many would miss what lies between modes.
const FEWEST: usize = 24;
/// Points around a mode, in half its width at half its power.
const AROUND: [f64; 9] = [0.0, 0.3, 0.6, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// Instants per period of the highest harmonic, where there are several: the largest value is met to (π/64)²/2, about
/// 0.1 %.
const INSTANTS: usize = 64;
/// Most instants; harmonics up to 64 have all of theirs.
const MOST_INSTANTS: usize = 4096;
/// Halvings with which a border between stick and slip is found: a millionth of a millionth of the step.
const HALVINGS: usize = 40;
/// Share of two steps to which the place of the largest load is found: the load is flat there.
const LOCATED: f64 = 1e-5;
/// Compliance of a rigid joint, as a share of that of the structure: joints that hold in a ring share the load by it.
const COMPLIANCE: f64 = 1e-10;

impl Survey {
    /// Degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.system.dofs()
    }

    /// The assembled model.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Whether the model has too many degrees of freedom for its modes, which then count as lost.
    pub fn is_too_large(&self) -> bool {
        self.dofs() > LARGEST
    }

    /// Modes with all joints free.
    pub fn free(&self) -> &Modes {
        &self.free.modes
    }

    /// Modes with all joints stuck.
    pub fn stuck(&self) -> &Modes {
        &self.stuck.modes
    }

    /// Bodies that no spring holds.
    pub fn loose(&self) -> &[Loose] {
        &self.loose
    }

    /// When each joint begins to slip, in the order of the model.
    pub fn first_slip(&self) -> Vec<FirstSlip> {
        let one = |joint: &Stuck| {
            let (limit, displacement) = match joint.hold {
                Hold::Nothing => (0.0, None),
                Hold::Spring { limit, displacement, .. } => (limit, Some(displacement)),
                Hold::Rigid { limit } => (limit, None),
            };
            FirstSlip { joint: joint.name.clone(), limit, displacement, pressed: joint.pressed }
        };
        self.joints.iter().map(one).collect()
    }

    /// The loads of the stuck joints under the model's excitation, as shares of their limits, over drive frequencies
    /// from `from` to `to` (rad/s), which may be the same. Constant forces are left out: how joints share these
    /// depends on what was before.
    ///
    /// `None`: the model is so large that this would take long, or it has no linear response there.
    pub fn onset(&self, from: f64, to: f64) -> Option<Vec<Onset>> {
        let omegas = self.frequencies(from, to)?;
        if self.joints.is_empty() {
            return Some(Vec::new());
        }
        let shares: Vec<Vec<f64>> = omegas.iter().map(|omega| self.shares(*omega)).collect::<Option<_>>()?;
        if shares.iter().flatten().any(|share| share.is_nan()) {
            return None;
        }
        (0..self.joints.len()).map(|joint| self.onset_of(joint, &omegas, &shares)).collect()
    }

    /// The modal amplitude (m √kg) at which the first joint slips in mode `index` (from 0) of the stuck structure;
    /// `None` if it has no such mode or no joint is loaded in it.
    pub fn slip_amplitude(&self, index: usize) -> Option<f64> {
        let shapes = self.stuck.shapes.as_ref()?;
        let omega = self.stuck.modes.elastic.get(index)?.omega;
        let shape = shapes.column(index).into_owned();
        let motion = |joint: &Stuck| joint.at.iter().map(|(i, w)| w * shape[*i]).sum::<f64>();
        let (n, rigid) = (self.dofs(), self.rigid());
        // the constraint forces balance what springs and inertia leave: W f = ω²Mφ - Kφ - W k u
        let mut rest =
            self.system.structure().mass() * &shape * (omega * omega) - self.system.structure().stiffness() * &shape;
        for joint in &self.joints {
            if let Hold::Spring { stiffness, .. } = joint.hold {
                let force = stiffness * motion(joint);
                joint.at.iter().for_each(|(i, w)| rest[*i] -= w * force);
            }
        }
        let mut w = DMatrix::<f64>::zeros(n, rigid.len());
        for (column, joint) in rigid.iter().enumerate() {
            self.joints[*joint].at.iter().for_each(|(i, value)| w[(*i, column)] += value);
        }
        let normal = w.transpose() * &w + DMatrix::identity(rigid.len(), rigid.len()) * COMPLIANCE;
        let forces = Cholesky::new(normal)?.solve(&(w.transpose() * rest));
        let share = |(index, joint): (usize, &Stuck)| match joint.hold {
            Hold::Nothing => 0.0,
            Hold::Spring { displacement, .. } => motion(joint).abs() / displacement,
            Hold::Rigid { limit } => {
                rigid.iter().position(|r| *r == index).map_or(0.0, |column| forces[column].abs() / limit)
            }
        };
        let largest = self.joints.iter().enumerate().map(share).fold(0.0, f64::max);
        (largest > 0.0).then(|| 1.0 / largest)
    }

    fn rigid(&self) -> Vec<usize> {
        let rigid = |joint: &Stuck| matches!(joint.hold, Hold::Rigid { .. }) && !joint.at.is_empty();
        (0..self.joints.len()).filter(|j| rigid(&self.joints[*j])).collect()
    }

    /// Drive frequencies that show the loads of stuck joints: evenly over the range, and around the modes that a
    /// harmonic of the excitation meets in it.
    fn frequencies(&self, from: f64, to: f64) -> Option<Vec<f64>> {
        // stiffnesses that had to count as rigid leave no digits for a response
        self.stuck.shapes.as_ref()?;
        if !(from > 0.0 && from <= to && to.is_finite()) {
            return None;
        }
        let unknowns = (self.dofs() + self.rigid().len()) as f64;
        let harmonics = self.harmonics();
        let cost = (unknowns.powi(3) / 3.0).max(1.0) * harmonics.len().max(1) as f64;
        let affordable = (WORK / cost) as usize;
        if from == to {
            return (affordable > 0).then(|| vec![from]);
        }
        let count = FREQUENCIES.min(affordable / 2);
        if count < FEWEST {
            return None;
        }
        let mut omegas: Vec<f64> =
            (0..=count).map(|i| from + (to - from) * i as f64 / count as f64).map(|w| w.min(to)).collect();
        let mut around = Vec::new();
        for mode in &self.stuck.modes.elastic {
            let width = mode.damping.clamp(1e-6, 0.1) * mode.omega;
            for h in &harmonics {
                let points = AROUND.iter().flat_map(|a| [mode.omega - a * width, mode.omega + a * width]);
                around.extend(points.map(|w| w / f64::from(*h)).filter(|w| (from..=to).contains(w)));
            }
        }
        around.truncate(affordable / 2);
        omegas.extend(around);
        omegas.sort_by(f64::total_cmp);
        omegas.dedup();
        Some(omegas)
    }

    /// Harmonics of the excitation that are not zero, each once, rising, without the constant part.
    pub fn harmonics(&self) -> Vec<u32> {
        let mut harmonics = self.system.harmonics_of_excitation(|z| z != Complex64::ZERO);
        harmonics.retain(|h| *h > 0);
        harmonics.sort_unstable();
        harmonics.dedup();
        harmonics
    }

    /// Largest load over limit of every joint in one period at the drive frequency `omega`, all joints stuck.
    fn shares(&self, omega: f64) -> Option<Vec<f64>> {
        let harmonics = self.harmonics();
        let loads = harmonics.iter().map(|h| self.joint_loads(*h, omega)).collect::<Option<Vec<_>>>()?;
        let largest = |joint: usize| match &loads[..] {
            [] => 0.0,
            [one] => one[joint].norm(),
            several => {
                let highest = harmonics.last().copied().unwrap_or(1) as usize;
                let instants = (INSTANTS * highest).min(MOST_INSTANTS);
                let at = |i: usize| {
                    let terms = several.iter().zip(&harmonics);
                    let phase = |h: u32| TAU * ((i * h as usize) % instants) as f64 / instants as f64;
                    terms.map(|(load, h)| (load[joint] * Complex64::from_polar(1.0, phase(*h))).re).sum::<f64>()
                };
                (0..instants).map(|i| at(i).abs()).fold(0.0, f64::max)
            }
        };
        Some((0..self.joints.len()).map(largest).collect())
    }

    /// Complex load over limit of every stuck joint at harmonic `h`: `Z x + W f = F`, `Wᵀx + g = 0` for rigid joints.
    fn joint_loads(&self, h: u32, omega: f64) -> Option<Vec<Complex64>> {
        let (n, rigid, system) = (self.dofs(), self.rigid(), &self.system);
        let w = f64::from(h) * omega;
        let mut a = DMatrix::<Complex64>::zeros(n + rigid.len(), n + rigid.len());
        let mut b = DVector::<Complex64>::zeros(n + rigid.len());
        for i in 0..n {
            for j in 0..n {
                let real = system.structure().stiffness()[(i, j)] - w * w * system.structure().mass()[(i, j)];
                a[(i, j)] = Complex64::new(real, w * system.structure().damping()[(i, j)]);
            }
        }
        if let Some(load) = system.loads().iter().find(|load| load.harmonic == h) {
            for i in 0..n {
                b[i] = load.force[i] + Complex64::new(0.0, w) * load.by_velocity[i];
            }
        }
        let imposed = |index: usize| {
            let Stuck { joint, axis, .. } = self.joints[index];
            system.joints()[joint].axes()[axis].imposed_at(h)
        };
        for (index, joint) in self.joints.iter().enumerate() {
            if let Hold::Spring { stiffness, .. } = joint.hold {
                for (i, wi) in &joint.at {
                    b[*i] -= imposed(index) * (wi * stiffness);
                    for (j, wj) in &joint.at {
                        a[(*i, *j)] += wi * wj * stiffness;
                    }
                }
            }
        }
        let scale = (0..n).map(|i| a[(i, i)].norm()).fold(0.0, f64::max);
        for (row, joint) in rigid.iter().enumerate() {
            for (i, wi) in &self.joints[*joint].at {
                a[(*i, n + row)] += wi;
                a[(n + row, *i)] += wi;
            }
            a[(n + row, n + row)] -= COMPLIANCE / scale.max(f64::MIN_POSITIVE);
            b[n + row] = -imposed(*joint);
        }
        let x = if n + rigid.len() == 0 { b } else { a.lu().solve(&b)? };
        let share = |(index, joint): (usize, &Stuck)| match joint.hold {
            Hold::Nothing => Some(Complex64::ZERO),
            Hold::Spring { displacement, .. } => {
                Some((joint.at.iter().map(|(i, w)| x[*i] * *w).sum::<Complex64>() + imposed(index)) / displacement)
            }
            Hold::Rigid { limit } => match rigid.iter().position(|r| *r == index) {
                Some(row) => Some(x[n + row] / limit),
                // a moved place against the ground or another moved place cannot stick
                None if imposed(index) != Complex64::ZERO => Some(Complex64::new(f64::INFINITY, 0.0)),
                None => Some(Complex64::ZERO),
            },
        };
        self.joints.iter().enumerate().map(share).collect()
    }

    /// What the samples say of one joint, its largest load and the borders refined.
    fn onset_of(&self, joint: usize, omegas: &[f64], shares: &[Vec<f64>]) -> Option<Onset> {
        let at = |omega: f64| Some(self.shares(omega)?[joint]);
        let value = |i: usize| shares[i][joint];
        let top = (0..omegas.len()).max_by(|&a, &b| value(a).total_cmp(&value(b)))?;
        let mut best = (omegas[top], value(top));
        // a few joints are refined; of hundreds the samples are good enough
        let refined = (self.dofs() + self.joints.len()) <= REFINED;
        if refined && omegas.len() > 1 && best.1.is_finite() {
            let (low, high) = (omegas[top.saturating_sub(1)], omegas[(top + 1).min(omegas.len() - 1)]);
            let close = |a: f64, b: f64| b - a <= LOCATED * (high - low);
            let found = maximum((low, high), close, |omega| at(omega).ok_or(())).ok()?;
            if found.1 > best.1 {
                best = found;
            }
        }
        let border = |inside: f64, outside: f64| -> Option<f64> {
            let (mut inside, mut outside) = (inside, outside);
            for _ in 0..if refined { HALVINGS } else { 0 } {
                let middle = 0.5 * (inside + outside);
                if at(middle)? > 1.0 { inside = middle } else { outside = middle }
            }
            Some(inside)
        };
        // the refined top may be a peak that the samples only see from below
        let mut points: Vec<(f64, f64)> = omegas.iter().copied().zip((0..omegas.len()).map(value)).collect();
        points.push(best);
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut slips: Vec<(f64, f64)> = Vec::new();
        let mut begin = points.first().filter(|p| p.1 > 1.0).map(|p| p.0);
        for pair in points.windows(2) {
            let ((w, a), (v, b)) = (pair[0], pair[1]);
            match (a > 1.0, b > 1.0) {
                (false, true) => begin = Some(border(v, w)?),
                (true, false) => slips.extend(begin.take().zip(Some(border(w, v)?))),
                _ => {}
            }
        }
        slips.extend(begin.zip(points.last().map(|p| p.0)));
        Some(Onset { largest: best.1, at: best.0, slips })
    }
}

/// Degrees of freedom and joints up to which borders are refined.
const REFINED: usize = 40;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Jenkins, JenkinsArctan};

    #[test]
    fn laws_hold_as_they_do_in_small_motion() {
        let spring = Hold::Spring { stiffness: 1e4, limit: 2.0, displacement: 2e-4 };
        assert_eq!(Hold::of(&Jenkins { stiffness: 1e4, limit: 2.0 }, 0), spring);
        assert_eq!(Hold::of(&JenkinsArctan { stiffness: 1e4, limit: 2.0, alpha: 25e3 }, 0), spring);
        assert_eq!(Hold::of(&Coulomb { limit: 2.0 }, 0), Hold::Rigid { limit: 2.0 });
        assert_eq!(Hold::of(&CoulombArctan { limit: 2.0, alpha: 25e3 }, 0), Hold::Rigid { limit: 2.0 });
        // without a limit a joint is a free reference
        assert_eq!(Hold::of(&Jenkins { stiffness: 1e4, limit: 0.0 }, 0), Hold::Nothing);
        assert_eq!(Hold::of(&Coulomb { limit: 0.0 }, 0), Hold::Nothing);
    }

    #[test]
    fn constraints_remove_places_without_mass_first() {
        // place 1 has no mass; 0 = 1, and the same once more
        let at = [(0, 1.0), (1, -1.0)];
        let basis = Basis::new(3, &[1, 0, 2], &[&at, &at]);
        assert_eq!(basis.kept, [0, 2]);
        assert_eq!(basis.rows, [vec![(0, 1.0)], vec![(0, 1.0)], vec![(1, 1.0)]]);
        assert!(basis.along(&at).is_empty());
    }
}
