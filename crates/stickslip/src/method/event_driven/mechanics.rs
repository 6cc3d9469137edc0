//! The system as the event-driven method sees it: masses, springs, ideal parts of joints, one drive frequency.

use crate::law::{Contact, Law, Piece};
use crate::method::MethodError;
use crate::model::System;
use crate::structure::Matrices;
use nalgebra::{DMatrix, DVector};
use std::ops::Deref;
use std::sync::Arc;

/// A relative velocity below this fraction of the largest one is rest. Switch instants are found to 1e-15 of the velocity scale;
/// joints that switch together by symmetry differ by the rounding of the whole orbit, about 1e-12.
pub(crate) const REST: f64 = 1e-10;

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

/// One ideal part of a joint.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// The joint it belongs to.
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

/// Why the method cannot take a law: what it misses.
fn refusal(law: &dyn Law) -> Option<&'static str> {
    let Some(pieces) = law.pieces() else { return Some("it is not made of ideal sliders, springs and stops") };
    let drops = |piece: &Piece| matches!(piece, Piece::Slider(s) if s.stiffness.is_some() && s.static_limit > s.limit);
    if law.directions() != 1 {
        Some("it acts along several directions")
    } else if pieces.iter().any(drops) {
        Some("the slider behind its spring holds more than it carries in slip")
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
    /// Sliders and stops of all joints, those that carry nothing left out.
    pub parts: Arc<[Part]>,
    /// Names of the joints, for errors.
    pub names: Arc<[String]>,
    /// Number of sliders behind springs.
    pub elastic: usize,
    /// Estimate of the fastest natural frequency, rad/s.
    pub fastest: f64,
}

/// Mass, damping and stiffness are read as its own.
impl Deref for Mechanics {
    type Target = Matrices;
    fn deref(&self) -> &Matrices {
        &self.matrices
    }
}

impl Mechanics {
    /// # Errors
    /// A joint whose law has no exact view, or none that can be followed ([`refusal`]); a place without mass.
    pub fn new(system: &System) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(error) = MethodError::too_large(super::NAME, system) {
            return Err(error);
        }
        if let Some(i) = (0..n).find(|&i| system.structure().own_mass(i) <= 0.0) {
            return Err(MethodError::needs_mass(super::NAME, system, i));
        }
        let mut parts = Vec::new();
        let mut elastic = 0;
        for (j, joint) in system.joints().iter().enumerate() {
            if let Some(misses) = refusal(joint.law().as_ref()) {
                return Err(MethodError::law(super::NAME, joint, misses));
            }
            let axis = &joint.axes()[0];
            for piece in joint.law().pieces().unwrap_or_default() {
                let kind = match piece {
                    Piece::Slider(slider) if slider.static_limit == 0.0 => continue,
                    Piece::Stop { stiffness: 0.0, .. } => continue,
                    Piece::Slider(slider) => match slider.stiffness {
                        None => Kind::Rigid { limit: slider.limit, static_limit: slider.static_limit },
                        Some(stiffness) => {
                            elastic += 1;
                            Kind::Elastic { stiffness, limit: slider.limit, state: elastic - 1 }
                        }
                    },
                    // a stop knows where it is: imposed motion counts with its mean
                    Piece::Stop { gap, stiffness } => Kind::Stop { stiffness, gap: gap - axis.imposed_at(0).re },
                };
                parts.push(Part { joint: j, direction: axis.dense(n), kind });
            }
        }
        let positive = system.structure().mass().clone().cholesky().is_some();
        let inverse_mass = system
            .structure()
            .mass()
            .clone()
            .try_inverse()
            .filter(|inverse| positive && inverse.iter().all(|x| x.is_finite()))
            .ok_or_else(|| MethodError::mass_not_positive(super::NAME))?;
        let fastest = (0..n)
            .map(|i| (system.structure().stiffness()[(i, i)] / system.structure().mass()[(i, i)]).sqrt())
            .fold(0.0, f64::max);
        Ok(Mechanics {
            n,
            fastest,
            matrices: system.structure().full().clone(),
            inverse_mass,
            parts: parts.into(),
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

    /// The joint of every part.
    pub fn owners(&self) -> Vec<usize> {
        self.parts.iter().map(|part| part.joint).collect()
    }

    /// Length of the state `(x, v, forces of sliders behind springs)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.elastic
    }
}
