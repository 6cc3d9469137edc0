//! The system as the event-driven method sees it: masses, springs, ideal parts of joints, one drive frequency.
//!
//! Rigid sliders along one line have one relative motion, and begin to slip and come to rest together. They are one part with the sums of their
//! limits, so that rounding cannot decide otherwise for one of them than for the next, and no problem is posed whose solution is not unique.
//! What each carries of the part's force is its [`Share`].

use crate::law::{Contact, Law, Piece};
use crate::method::{MethodError, Refusal};
use crate::model::{Line, System};
use crate::structure::Matrices;
use nalgebra::{DMatrix, DVector};
use std::ops::Deref;
use std::sync::Arc;

/// A relative velocity below this fraction of the largest one is rest. Switch instants are found to 1e-15 of the velocity scale;
/// joints that switch together by symmetry differ by the rounding of the whole orbit, about 1e-12.
pub(crate) const REST: f64 = 1e-10;

/// How many times lighter than what it rubs on a place between rigid sliders may be. Accelerations below 1e-9 of what the limits do to the lightest mass of
/// a slider count as none, which is a tenth of what they do to the heaviest one then. Measured: right to 1e8, chatter from 1e9, other orbits from 1e12.
const LIGHTEST: f64 = 1e8;

/// What a part of a joint does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    /// A rigid slider: moves with the force `limit`, and once it rests holds up to `static_limit`, N.
    Rigid { limit: f64, static_limit: f64 },
    /// A slider behind a spring (N/m) with its limit (N), and the index of its force among the states.
    Elastic { stiffness: f64, limit: f64, state: usize },
    /// A spring (N/m) beyond a gap (m), constant imposed motion counted in.
    Stop { stiffness: f64, gap: f64 },
}

/// One ideal part of a joint, or several rigid sliders along one line.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// The joint it belongs to; of several, the first.
    pub joint: usize,
    /// Direction, length n.
    pub direction: DVector<f64>,
    pub kind: Kind,
}

impl Part {
    /// The spring in it, N/m.
    pub fn stiffness(&self) -> Option<f64> {
        match self.kind {
            Kind::Rigid { .. } => None,
            Kind::Elastic { stiffness, .. } | Kind::Stop { stiffness, .. } => Some(stiffness),
        }
    }

    /// Force while it slips, N; a stop never does.
    pub fn limit(&self) -> f64 {
        match self.kind {
            Kind::Rigid { limit, .. } | Kind::Elastic { limit, .. } => limit,
            Kind::Stop { .. } => 0.0,
        }
    }

    /// The largest force with which it rests, N.
    pub fn holds(&self) -> f64 {
        match self.kind {
            Kind::Rigid { static_limit, .. } => static_limit,
            Kind::Elastic { limit, .. } => limit,
            Kind::Stop { .. } => f64::INFINITY,
        }
    }

    /// Index of its force among the states, for a slider behind a spring.
    pub fn state(&self) -> Option<usize> {
        match self.kind {
            Kind::Elastic { state, .. } => Some(state),
            _ => None,
        }
    }

    /// Whether it is a slider.
    pub fn is_slider(&self) -> bool {
        !matches!(self.kind, Kind::Stop { .. })
    }

    /// Whether its force drops when it begins to slip.
    pub fn drops(&self) -> bool {
        self.holds() > self.limit() && self.is_slider()
    }

    /// The rows that it acts on.
    fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        self.direction.iter().enumerate().filter(|(_, weight)| **weight != 0.0).map(|(row, _)| row)
    }

    /// What displacements or velocities are along it, without imposed motion.
    pub fn along(&self, values: &[f64]) -> f64 {
        self.direction.iter().zip(values).map(|(w, x)| w * x).sum()
    }

    /// What of the force is the same as long as a contact lasts, N.
    pub fn constant_force(&self, contact: Contact) -> f64 {
        match (self.kind, contact) {
            (Kind::Stop { stiffness, gap }, Contact::Stick) => -stiffness * gap,
            (Kind::Stop { .. }, _) => 0.0,
            (_, contact) => contact.sign() * self.limit(),
        }
    }
}

/// What a joint has of a part: the whole, or its share of several rigid sliders along one line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Share {
    pub joint: usize,
    pub part: usize,
    /// Force of the joint per force of the part while it slips and while it rests, by the limits of each. Negative in joints that point the other
    /// way.
    slipping: f64,
    resting: f64,
}

impl Share {
    fn whole(joint: usize, part: usize) -> Self {
        Share { joint, part, slipping: 1.0, resting: 1.0 }
    }

    /// Force of the joint per force of the part in this contact.
    pub fn of(&self, contact: Contact) -> f64 {
        if contact.slips() { self.slipping } else { self.resting }
    }

    /// The joint's contact, from its part's.
    pub fn contact(&self, contact: Contact) -> Contact {
        if self.resting < 0.0 { contact.mirrored() } else { contact }
    }
}

/// A rigid slider of a joint, before those along one line are one part.
struct Slider {
    joint: usize,
    line: Line,
    direction: DVector<f64>,
    limit: f64,
    static_limit: f64,
}

/// Rigid sliders along one line: the part that they are, and all of them.
struct Group {
    part: usize,
    line: Line,
    members: Vec<Member>,
}

/// One of them.
struct Member {
    /// Which of the shares is its.
    share: usize,
    /// Its relative motion per that of the first.
    factor: f64,
    /// Limit and static limit, N.
    limits: (f64, f64),
}

impl Group {
    /// Limit and static limit of all together, along the first, N.
    fn limits(&self) -> (f64, f64) {
        let add = |sum: (f64, f64), Member { factor, limits, .. }: &Member| {
            (sum.0 + factor.abs() * limits.0, sum.1 + factor.abs() * limits.1)
        };
        self.members.iter().fold((0.0, 0.0), add)
    }
}

/// Parts and shares as they are gathered, joint after joint.
#[derive(Default)]
struct Gathered {
    parts: Vec<Part>,
    shares: Vec<Share>,
    groups: Vec<Group>,
}

impl Gathered {
    fn push(&mut self, part: Part) {
        self.shares.push(Share::whole(part.joint, self.parts.len()));
        self.parts.push(part);
    }

    fn push_rigid(&mut self, slider: Slider) {
        let (share, limits) = (self.shares.len(), (slider.limit, slider.static_limit));
        let found = self.groups.iter().enumerate().find_map(|(i, group)| Some((i, slider.line.along(&group.line)?)));
        let (group, factor) = found.unwrap_or((self.groups.len(), 1.0));
        if let Some(group) = self.groups.get(group) {
            self.shares.push(Share::whole(slider.joint, group.part));
        } else {
            let kind = Kind::Rigid { limit: limits.0, static_limit: limits.1 };
            let part = self.parts.len();
            self.push(Part { joint: slider.joint, direction: slider.direction, kind });
            self.groups.push(Group { part, line: slider.line, members: Vec::new() });
        }
        self.groups[group].members.push(Member { share, factor, limits });
    }

    /// Gives the parts of several the sums of their limits, and each joint its share.
    fn finish(mut self) -> (Arc<[Part]>, Arc<[Share]>) {
        for group in self.groups.iter().filter(|group| group.members.len() > 1) {
            let (limit, static_limit) = group.limits();
            self.parts[group.part].kind = Kind::Rigid { limit, static_limit };
            for Member { share, factor, limits } in &group.members {
                let share = &mut self.shares[*share];
                // without any force in slip there is nothing to share
                share.slipping = if limit > 0.0 { factor.signum() * limits.0 / limit } else { 0.0 };
                share.resting = factor.signum() * limits.1 / static_limit;
            }
        }
        (self.parts.into(), self.shares.into())
    }
}

/// Why the method cannot take a law: what it misses.
fn refusal(law: &dyn Law) -> Option<&'static str> {
    let Some(pieces) = law.pieces() else { return Some("it does not consist of ideal sliders, springs and stops") };
    let drops = |piece: &Piece| matches!(piece, Piece::Slider(s) if s.stiffness.is_some() && s.static_limit > s.limit);
    if law.directions() != 1 {
        Some("it acts along several directions")
    } else if pieces.iter().any(drops) {
        Some("its slider in series with a spring has a static limit above its dynamic limit")
    } else {
        None
    }
}

/// Whether the method can follow a law.
pub(crate) fn takes(law: &dyn Law) -> bool {
    refusal(law).is_none()
}

/// Matrices and parts of joints; independent of the drive frequency.
#[derive(Debug, Clone)]
pub(crate) struct Mechanics {
    pub n: usize,
    /// Of the structure, shared with it.
    matrices: Arc<Matrices>,
    pub inverse_mass: DMatrix<f64>,
    /// Sliders and stops of all joints, those that carry nothing left out, rigid ones along one line as one.
    pub parts: Arc<[Part]>,
    /// What the joints have of them, joint after joint.
    pub shares: Arc<[Share]>,
    /// Names of the joints, for errors.
    pub names: Arc<[String]>,
    /// Number of sliders behind springs.
    pub elastic: usize,
    /// Estimate of the fastest natural frequency, rad/s.
    pub fastest: f64,
    /// The same of the masses that each part acts on.
    pub fastest_along: Arc<[f64]>,
}

/// A place between several rigid sliders that is too light beside what one of them joins it to.
fn light(system: &System, parts: &[Part], method: &'static str) -> Option<MethodError> {
    let rigid = || parts.iter().filter(|part| matches!(part.kind, Kind::Rigid { .. }));
    let mass = |row: usize| system.structure().own_mass(row);
    rigid().find_map(|part| {
        let lightest = part.rows().min_by(|&a, &b| mass(a).total_cmp(&mass(b)))?;
        let ratio = part.rows().map(mass).fold(0.0, f64::max) / mass(lightest);
        let several = rigid().filter(|part| part.direction[lightest] != 0.0).nth(1).is_some();
        (several && ratio > LIGHTEST).then(|| {
            let place = system.structure().places()[lightest].clone();
            let joint = system.joints()[part.joint].name().to_owned();
            Refusal::Light { method, place, joint, ratio, least: LIGHTEST.recip() }.into()
        })
    })
}

/// Mass, damping and stiffness are read as its own.
impl Deref for Mechanics {
    type Target = Matrices;
    fn deref(&self) -> &Matrices {
        &self.matrices
    }
}

impl Mechanics {
    /// Multiplies the slip limits of these joints by a factor.
    pub fn strengthen(&mut self, joints: &[usize], factor: f64) {
        let mut parts = self.parts.to_vec();
        for part in parts.iter_mut().filter(|part| joints.contains(&part.joint)) {
            match &mut part.kind {
                Kind::Rigid { limit, static_limit } => {
                    (*limit, *static_limit) = (*limit * factor, *static_limit * factor)
                }
                Kind::Elastic { limit, .. } => *limit *= factor,
                Kind::Stop { .. } => {}
            }
        }
        self.parts = parts.into();
    }

    /// For `method`, which names itself where it refuses.
    ///
    /// # Errors
    /// A joint whose law has no exact view, or none that can be followed ([`refusal`]); a place without mass.
    pub fn new(system: &System, method: &'static str) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(error) = MethodError::too_large(method, system) {
            return Err(error);
        }
        if let Some(i) = (0..n).find(|&i| system.structure().own_mass(i) <= 0.0) {
            return Err(MethodError::needs_mass(method, system, i));
        }
        let mut gathered = Gathered::default();
        let mut elastic = 0;
        for (j, joint) in system.joints().iter().enumerate() {
            if let Some(misses) = refusal(joint.law().as_ref()) {
                return Err(MethodError::law(method, joint, misses));
            }
            let axis = &joint.axes()[0];
            for piece in joint.law().pieces().unwrap_or_default() {
                let direction = axis.dense(n);
                let kind = match piece {
                    Piece::Slider(slider) if slider.static_limit == 0.0 => continue,
                    Piece::Stop { stiffness: 0.0, .. } => continue,
                    Piece::Slider(slider) => match slider.stiffness {
                        None => {
                            let (limit, static_limit) = (slider.limit, slider.static_limit);
                            let line = Line::of(axis);
                            gathered.push_rigid(Slider { joint: j, line, direction, limit, static_limit });
                            continue;
                        }
                        Some(stiffness) => {
                            elastic += 1;
                            Kind::Elastic { stiffness, limit: slider.limit, state: elastic - 1 }
                        }
                    },
                    // a stop knows where it is: imposed motion counts with its mean
                    Piece::Stop { gap, stiffness } => Kind::Stop { stiffness, gap: gap - axis.imposed_at(0).re },
                };
                gathered.push(Part { joint: j, direction, kind });
            }
        }
        let (parts, shares) = gathered.finish();
        let positive = system.structure().mass().clone().cholesky().is_some();
        let inverse_mass = system
            .structure()
            .mass()
            .clone()
            .try_inverse()
            .filter(|inverse| positive && inverse.iter().all(|x| x.is_finite()))
            .ok_or_else(|| MethodError::mass_not_positive(method))?;
        if let Some(error) = light(system, &parts, method) {
            return Err(error);
        }
        let rate = |i: usize| (system.structure().stiffness()[(i, i)] / system.structure().mass()[(i, i)]).sqrt();
        let fastest = (0..n).map(rate).fold(0.0, f64::max);
        let fastest_along = parts.iter().map(|part| part.rows().map(rate).fold(0.0, f64::max)).collect();
        Ok(Mechanics {
            n,
            fastest,
            fastest_along,
            matrices: system.structure().full().clone(),
            inverse_mass,
            parts,
            shares,
            names: system.joints().iter().map(|joint| joint.name().to_owned()).collect(),
            elastic,
        })
    }

    /// A stop is at its gap within this distance, m. `velocity_scale` is the largest relative velocity of the motion, m/s.
    pub fn touch(&self, stop: &Part, omega: f64, velocity_scale: f64) -> f64 {
        let Kind::Stop { stiffness, gap } = stop.kind else { return 0.0 };
        let own = || (stiffness * self.inverse_mass.amax()).sqrt();
        let rate = Some(omega.max(self.fastest)).filter(|rate| *rate > 0.0).unwrap_or_else(own);
        REST * (velocity_scale / rate).max(gap.abs())
    }

    /// The joint of every part; of several along one line, the first.
    pub fn owners(&self) -> Vec<usize> {
        self.parts.iter().map(|part| part.joint).collect()
    }

    /// Length of the state `(x, v, forces of sliders behind springs)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.elastic
    }

    /// Weights of the energy norm: each displacement with the larger of its stiffness and its inertia.
    pub fn weights(&self, omega: f64) -> Vec<f64> {
        let mut weights = vec![1.0; self.states()];
        for i in 0..self.n {
            let inertia = omega * omega * self.mass[(i, i)];
            weights[i] = self.stiffness[(i, i)].max(inertia).sqrt();
            weights[self.n + i] = self.mass[(i, i)].sqrt();
        }
        for part in &*self.parts {
            if let (Some(s), Some(kt)) = (part.state(), part.stiffness()) {
                weights[2 * self.n + s] = 1.0 / kt.sqrt();
            }
        }
        weights
    }
}
