//! The system in the form of the event-driven method: masses, springs and ideal parts of
//! joints.
//!
//! Rigid sliders along one line have the same relative motion, and they start and stop to slip
//! together. They form one part with the sum of their limits. Otherwise rounding could give
//! them different contacts, and the friction problem would not have a unique solution. Each
//! joint receives a [`PartShare`] of the part's force.

use super::settings::EventDrivenSettings;
use crate::law::{Contact, IdealElement, Law};
use crate::method::{MethodError, Refusal};
use crate::model::{CollinearAxis, System};
use crate::structure::Matrices;
use nalgebra::{DMatrix, DVector};
use std::ops::Deref;
use std::sync::Arc;

/// The kind of a part of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PartKind {
    /// A rigid slider. It slips with the force `limit` and sticks up to `static_limit`, N.
    Rigid { limit: f64, static_limit: f64 },
    /// A slider in series with a spring (N/m): its limit (N), and the index of its force among
    /// the states.
    Elastic { stiffness: f64, limit: f64, state: usize },
    /// A spring (N/m) behind a gap (m). The gap includes constant imposed motion.
    Stop { stiffness: f64, gap: f64 },
}

/// One ideal part of a joint, or several rigid sliders along one line.
#[derive(Debug, Clone)]
pub(crate) struct JointPart {
    /// Index of its joint; for several sliders, the first.
    pub joint: usize,
    /// Direction, length n.
    pub direction: DVector<f64>,
    pub kind: PartKind,
}

impl JointPart {
    /// Returns the stiffness of its spring, N/m.
    pub fn stiffness(&self) -> Option<f64> {
        match self.kind {
            PartKind::Rigid { .. } => None,
            PartKind::Elastic { stiffness, .. } | PartKind::Stop { stiffness, .. } => Some(stiffness),
        }
    }

    /// Returns the force during slip, N; zero for a stop, which never slips.
    pub fn limit(&self) -> f64 {
        match self.kind {
            PartKind::Rigid { limit, .. } | PartKind::Elastic { limit, .. } => limit,
            PartKind::Stop { .. } => 0.0,
        }
    }

    /// Returns the largest force in stick, N.
    pub fn static_limit(&self) -> f64 {
        match self.kind {
            PartKind::Rigid { static_limit, .. } => static_limit,
            PartKind::Elastic { limit, .. } => limit,
            PartKind::Stop { .. } => f64::INFINITY,
        }
    }

    /// Returns the index of its force among the states, for a slider in series with a spring.
    pub fn state(&self) -> Option<usize> {
        match self.kind {
            PartKind::Elastic { state, .. } => Some(state),
            _ => None,
        }
    }

    /// Returns whether it is a slider.
    pub fn is_slider(&self) -> bool {
        !matches!(self.kind, PartKind::Stop { .. })
    }

    /// Returns whether its force drops at the onset of slip.
    pub fn force_drops(&self) -> bool {
        self.static_limit() > self.limit() && self.is_slider()
    }

    /// Iterates over the rows on which it acts.
    fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        self.direction.iter().enumerate().filter(|(_, weight)| **weight != 0.0).map(|(row, _)| row)
    }

    /// Returns the component of displacements or velocities along its direction, without
    /// imposed motion.
    pub fn along(&self, values: &[f64]) -> f64 {
        self.direction.iter().zip(values).map(|(w, x)| w * x).sum()
    }

    /// Returns the constant part of the force in a contact state, N.
    pub fn constant_force(&self, contact: Contact) -> f64 {
        match (self.kind, contact) {
            (PartKind::Stop { stiffness, gap }, Contact::Stick) => -stiffness * gap,
            (PartKind::Stop { .. }, _) => 0.0,
            (_, contact) => contact.sign() * self.limit(),
        }
    }
}

/// A joint's share of a part: the whole part, or a fraction of several rigid sliders along one
/// line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartShare {
    pub joint: usize,
    pub part: usize,
    /// Force of the joint per force of the part during slip, by the dynamic limits. Negative
    /// for joints of opposite direction. `resting` is the corresponding ratio in stick, by the
    /// static limits.
    slipping: f64,
    resting: f64,
}

impl PartShare {
    fn whole(joint: usize, part: usize) -> Self {
        PartShare { joint, part, slipping: 1.0, resting: 1.0 }
    }

    /// Returns the force of the joint per force of the part in this contact state.
    pub fn of(&self, contact: Contact) -> f64 {
        if contact.slips() { self.slipping } else { self.resting }
    }

    /// Returns the contact state of the joint from that of its part.
    pub fn contact(&self, contact: Contact) -> Contact {
        if self.resting < 0.0 { contact.mirrored() } else { contact }
    }
}

/// A rigid slider of a joint, before those along one line are combined.
struct RigidSlider {
    joint: usize,
    line: CollinearAxis,
    direction: DVector<f64>,
    limit: f64,
    static_limit: f64,
}

/// Rigid sliders along one line, with their common part.
struct CollinearSliders {
    part: usize,
    line: CollinearAxis,
    members: Vec<CollinearSlider>,
}

/// One slider of a group.
struct CollinearSlider {
    /// Index of its share.
    share: usize,
    /// Its relative motion divided by that of the first slider.
    factor: f64,
    /// Dynamic and static limit, N.
    limits: (f64, f64),
}

impl CollinearSliders {
    /// Returns the sums of dynamic and static limits along the first slider, N.
    fn limits(&self) -> (f64, f64) {
        let add = |sum: (f64, f64), CollinearSlider { factor, limits, .. }: &CollinearSlider| {
            (sum.0 + factor.abs() * limits.0, sum.1 + factor.abs() * limits.1)
        };
        self.members.iter().fold((0.0, 0.0), add)
    }
}

/// Parts and shares during collection, joint by joint.
#[derive(Default)]
struct PartCollector {
    parts: Vec<JointPart>,
    shares: Vec<PartShare>,
    groups: Vec<CollinearSliders>,
}

impl PartCollector {
    fn push(&mut self, part: JointPart) {
        self.shares.push(PartShare::whole(part.joint, self.parts.len()));
        self.parts.push(part);
    }

    fn push_rigid(&mut self, slider: RigidSlider) {
        let (share, limits) = (self.shares.len(), (slider.limit, slider.static_limit));
        let found = self.groups.iter().enumerate().find_map(|(i, group)| Some((i, slider.line.ratio_to(&group.line)?)));
        let (group, factor) = found.unwrap_or((self.groups.len(), 1.0));
        if let Some(group) = self.groups.get(group) {
            self.shares.push(PartShare::whole(slider.joint, group.part));
        } else {
            let kind = PartKind::Rigid { limit: limits.0, static_limit: limits.1 };
            let part = self.parts.len();
            self.push(JointPart { joint: slider.joint, direction: slider.direction, kind });
            self.groups.push(CollinearSliders { part, line: slider.line, members: Vec::new() });
        }
        self.groups[group].members.push(CollinearSlider { share, factor, limits });
    }

    /// Sets the limits of combined parts to the sums, and computes the share of each joint.
    fn finish(mut self) -> (Arc<[JointPart]>, Arc<[PartShare]>) {
        for group in self.groups.iter().filter(|group| group.members.len() > 1) {
            let (limit, static_limit) = group.limits();
            self.parts[group.part].kind = PartKind::Rigid { limit, static_limit };
            for CollinearSlider { share, factor, limits } in &group.members {
                let share = &mut self.shares[*share];
                // without a slip force, there is nothing to share
                share.slipping = if limit > 0.0 { factor.signum() * limits.0 / limit } else { 0.0 };
                share.resting = factor.signum() * limits.1 / static_limit;
            }
        }
        (self.parts.into(), self.shares.into())
    }
}

/// Returns the reason why the method does not support a law.
fn refusal(law: &dyn Law) -> Option<&'static str> {
    let Some(pieces) = law.ideal_elements() else {
        return Some("it does not consist of ideal sliders, springs and stops");
    };
    let drops = |piece: &IdealElement| matches!(piece, IdealElement::Slider(s) if s.stiffness.is_some() && s.static_limit > s.limit);
    if law.directions() != 1 {
        Some("it acts along several directions")
    } else if pieces.iter().any(drops) {
        Some("its slider in series with a spring has a static limit above its dynamic limit")
    } else {
        None
    }
}

/// Returns whether the method supports a law.
pub(crate) fn supports(law: &dyn Law) -> bool {
    refusal(law).is_none()
}

/// Matrices and parts of joints, independent of the excitation frequency.
#[derive(Debug, Clone)]
pub(crate) struct Mechanics {
    pub n: usize,
    /// Matrices of the structure, shared with it.
    matrices: Arc<Matrices>,
    pub inverse_mass: DMatrix<f64>,
    /// Sliders and stops of all joints, without those of zero force. Rigid sliders along one
    /// line are combined.
    pub parts: Arc<[JointPart]>,
    /// Shares of the joints, joint by joint.
    pub shares: Arc<[PartShare]>,
    /// Names of the joints, for errors.
    pub names: Arc<[String]>,
    /// Number of sliders in series with springs.
    pub elastic: usize,
    /// Estimate of the highest natural frequency, rad/s.
    pub fastest: f64,
    /// This estimate for the masses of each part.
    pub fastest_along: Arc<[f64]>,
}

/// Returns an error if a place between several rigid sliders is too light compared with an
/// adjacent mass.
fn light_place_error(system: &System, parts: &[JointPart], method: &'static str) -> Option<MethodError> {
    let rigid = || parts.iter().filter(|part| matches!(part.kind, PartKind::Rigid { .. }));
    // Largest mass ratio at a place between rigid sliders. Accelerations below 1e-9 of those that
    // the limits cause at the lightest mass count as zero. At this ratio, that is a tenth of those
    // at the heaviest mass. Measured: correct up to 1e8, chatter from 1e9, wrong orbits from 1e12.
    let most: f64 = 1e8;
    let mass = |row: usize| system.structure().diagonal_mass(row);
    rigid().find_map(|part| {
        let lightest = part.rows().min_by(|&a, &b| mass(a).total_cmp(&mass(b)))?;
        let ratio = part.rows().map(mass).fold(0.0, f64::max) / mass(lightest);
        let several = rigid().filter(|part| part.direction[lightest] != 0.0).nth(1).is_some();
        (several && ratio > most).then(|| {
            let place = system.structure().places()[lightest].clone();
            let joint = system.joints()[part.joint].name().to_owned();
            Refusal::NegligibleMass { method, place, joint, ratio, least: most.recip() }.into()
        })
    })
}

/// Gives direct access to mass, damping and stiffness.
impl Deref for Mechanics {
    type Target = Matrices;
    fn deref(&self) -> &Matrices {
        &self.matrices
    }
}

impl Mechanics {
    /// Multiplies the slip limits of these joints by a factor.
    pub fn scale_limits(&mut self, joints: &[usize], factor: f64) {
        let mut parts = self.parts.to_vec();
        for part in parts.iter_mut().filter(|part| joints.contains(&part.joint)) {
            match &mut part.kind {
                PartKind::Rigid { limit, static_limit } => {
                    (*limit, *static_limit) = (*limit * factor, *static_limit * factor)
                }
                PartKind::Elastic { limit, .. } => *limit *= factor,
                PartKind::Stop { .. } => {}
            }
        }
        self.parts = parts.into();
    }

    /// Creates it for `method`, which error messages name.
    ///
    /// # Errors
    /// A law that the method does not support (see [`refusal`]), or a place without mass.
    pub fn new(system: &System, method: &'static str) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(error) = MethodError::too_large(method, system) {
            return Err(error);
        }
        if let Some(i) = (0..n).find(|&i| system.structure().diagonal_mass(i) <= 0.0) {
            return Err(MethodError::needs_mass(method, system, i));
        }
        let mut gathered = PartCollector::default();
        let mut elastic = 0;
        for (j, joint) in system.joints().iter().enumerate() {
            if let Some(misses) = refusal(joint.law().as_ref()) {
                return Err(MethodError::law(method, joint, misses));
            }
            let axis = &joint.axes()[0];
            for piece in joint.law().ideal_elements().unwrap_or_default() {
                let direction = axis.dense(n);
                let kind = match piece {
                    IdealElement::Slider(slider) if slider.static_limit == 0.0 => continue,
                    IdealElement::Stop { stiffness: 0.0, .. } => continue,
                    IdealElement::Slider(slider) => match slider.stiffness {
                        None => {
                            let (limit, static_limit) = (slider.limit, slider.static_limit);
                            let line = CollinearAxis::of(axis);
                            gathered.push_rigid(RigidSlider { joint: j, line, direction, limit, static_limit });
                            continue;
                        }
                        Some(stiffness) => {
                            elastic += 1;
                            PartKind::Elastic { stiffness, limit: slider.limit, state: elastic - 1 }
                        }
                    },
                    // the position of a stop includes the mean of the imposed motion
                    IdealElement::Stop { gap, stiffness } => {
                        PartKind::Stop { stiffness, gap: gap - axis.imposed_at(0).re }
                    }
                };
                gathered.push(JointPart { joint: j, direction, kind });
            }
        }
        let (parts, shares) = gathered.finish();
        let positive = system.structure().has_definite_mass();
        let inverse_mass = system
            .structure()
            .mass()
            .clone()
            .try_inverse()
            .filter(|inverse| positive && inverse.iter().all(|x| x.is_finite()))
            .ok_or_else(|| MethodError::mass_not_positive(method))?;
        if let Some(error) = light_place_error(system, &parts, method) {
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

    /// Returns the distance within which a stop counts as touching, m. `velocity_scale` is the
    /// largest relative velocity of the motion, m/s.
    pub fn contact_tolerance(&self, stop: &JointPart, omega: f64, velocity_scale: f64) -> f64 {
        let settings = EventDrivenSettings::default();
        let PartKind::Stop { stiffness, gap } = stop.kind else { return 0.0 };
        let own = || (stiffness * self.inverse_mass.amax()).sqrt();
        let rate = Some(omega.max(self.fastest)).filter(|rate| *rate > 0.0).unwrap_or_else(own);
        settings.zero_velocity * (velocity_scale / rate).max(gap.abs())
    }

    /// Returns the joint of every part; for several sliders along one line, the first.
    pub fn part_joints(&self) -> Vec<usize> {
        self.parts.iter().map(|part| part.joint).collect()
    }

    /// Returns the length of the state `(x, v, forces of sliders in series with springs)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.elastic
    }

    /// Returns the weights of the energy norm. The weight of a displacement uses the larger of
    /// its stiffness and its inertia.
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
