//! Survey of a model before any computation of orbits.
//!
//! A survey contains the linear modes with all joints free and with all joints stuck. It also
//! contains the motion at which each joint begins to slip, and the bodies that nothing holds.
//!
//! Free: no joint carries a force. Stuck: no slider slips, so that a joint is a set of springs,
//! or a constraint if it is rigid. The resonances of the model with friction lie between the
//! two, because springs and constraints only raise the frequency of every mode (Courant,
//! Fischer).

mod friction_hold;
mod linear_modes;
mod preload;
mod results;
mod rigid_body;
mod slip_onset;
mod stuck_joint;
mod wave_modes;

pub use friction_hold::FrictionDirection;
pub(crate) use friction_hold::soft_spring;
pub use results::{FirstSlip, LinearModes, LooseBody, NaturalMode, SlipOnset, UnloadedContacts};
pub use wave_modes::WaveModes;

use super::{Model, ModelError, System, SystemJoint};
use crate::law::{MAX_DIRECTIONS, SharedLaw};
use linear_modes::{LinearStructure, MAX_DOFS, SpringDamper};
use std::collections::HashMap;
use stuck_joint::{StuckAxis, StuckState};

/// Linear properties of a model: modes, onset of slip, loose bodies, preload.
#[derive(Debug, Clone)]
pub struct Survey {
    system: System,
    joints: Vec<StuckAxis>,
    free: LinearStructure,
    stuck: LinearStructure,
    /// Modes with open faces closed, if any faces are apart in static equilibrium.
    closed: Option<LinearStructure>,
    /// Contact forces in static equilibrium without rigid friction, N; see
    /// [`FirstSlip::equilibrium_force`].
    at_rest: Vec<Option<f64>>,
    loose: Vec<LooseBody>,
    unpressed: Option<UnloadedContacts>,
}

impl Model {
    /// Surveys the model, at the cost of two symmetric eigenvalue problems.
    ///
    /// # Errors
    /// See [`Model::assemble`].
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
        self.survey_under_load(&|_| None)
    }

    /// Surveys the model with the joint forces (N) of static equilibrium, along the directions
    /// of each joint.
    ///
    /// Faces without preload then count as pressed, not as apart, if constant loads press them
    /// together.
    ///
    /// # Errors
    /// See [`Model::assemble`].
    ///
    /// # Example
    /// A block of 1 kg lies on a contact and is pressed by 20 N.
    /// ```
    /// use std::sync::Arc;
    /// use stickslip::law::FrictionContact;
    /// use stickslip::method::StaticEquilibrium;
    /// use stickslip::model::{Force, GROUND, Joint, Mass, Model};
    /// let law = FrictionContact {
    ///     tangential: 1e6,
    ///     normal: 2e6,
    ///     friction: 0.3,
    ///     preload: 0.0,
    ///     tangents: 1,
    /// };
    /// let model = Model {
    ///     masses: vec![Mass::new("m", 1.0).along(&["t", "n"])],
    ///     joints: vec![Joint {
    ///         name: "foot".into(),
    ///         between: ["m".into(), GROUND.into()],
    ///         law: Arc::new(law),
    ///     }],
    ///     forces: vec![Force { on: "m.n".into(), amplitude: 20.0, phase: 0.0, harmonic: 0 }],
    ///     ..Model::default()
    /// };
    /// let survey = model
    ///     .survey_under_load(&|system| Some(StaticEquilibrium::of(system)?.forces()))
    ///     .unwrap();
    /// let slip = survey.first_slip();
    /// assert!(
    ///     (slip[0].limit - 6.0).abs() < 1e-9
    ///         && (slip[1].equilibrium_force.unwrap() - 20.0).abs() < 1e-9
    /// );
    /// assert_eq!(model.survey().unwrap().first_slip()[0].limit, 0.0);
    /// ```
    pub fn survey_under_load(
        &self,
        forces: &dyn Fn(&System) -> Option<Vec<[f64; MAX_DIRECTIONS]>>,
    ) -> Result<Survey, ModelError> {
        Ok(self.survey_of(&self.assemble()?, forces))
    }

    /// Returns the survey of [`Model::survey_under_load`] for the assembled model.
    pub fn survey_of(&self, system: &System, forces: &dyn Fn(&System) -> Option<Vec<[f64; MAX_DIRECTIONS]>>) -> Survey {
        let forces = forces(system);
        // contact force and law of joints without preload that the constant loads press
        // together
        let pressed = |index: usize, joint: &SystemJoint| -> Option<(f64, SharedLaw)> {
            let force = forces.as_ref()?.get(index)?[joint.law().normal()?];
            (force > 0.0).then(|| Some((force, joint.law().with_preload(force)?)))?
        };
        let of_joint = |(index, joint): (usize, &SystemJoint)| {
            let found = pressed(index, joint);
            StuckAxis::of_joint(index, joint, found.as_ref().map_or(&**joint.law(), |(_, law)| &**law))
        };
        let mut joints: Vec<StuckAxis> = system.joints().iter().enumerate().flat_map(of_joint).collect();
        let loose = self.loose(system, &joints);
        let mut at_rest = preload::equilibrium_forces(system, &joints);
        for (stuck, carried) in joints.iter().zip(&mut at_rest).filter(|(stuck, _)| stuck.pressed.is_some()) {
            let force = forces.as_ref().and_then(|forces| Some(forces.get(stuck.joint)?[stuck.axis]));
            let is_pressed = stuck.pressed.is_some_and(|preload| preload > 0.0);
            if let Some(force) = force.filter(|_| is_pressed) {
                // a negative force, as if the faces could not separate, says that they are open
                *carried = if force > 0.0 { Some(force) } else { carried.filter(|force| *force <= 0.0).or(Some(0.0)) };
            }
        }
        preload::set_limits_at_rest(&mut joints, &at_rest);
        let unpressed = if loose.is_empty() { None } else { preload::unpressed(system, &joints, &at_rest) };
        if system.dofs() > MAX_DOFS {
            let unresolved = system.dofs();
            let unknown = || LinearStructure {
                modes: LinearModes { unresolved, ..LinearModes::default() },
                shapes: None,
                gyroscopic: false,
            };
            let (free, stuck) = (unknown(), unknown());
            return Survey { free, stuck, closed: None, at_rest, system: system.clone(), joints, loose, unpressed };
        }
        let faces: Vec<SpringDamper> = joints
            .iter()
            .filter(|joint| joint.closed > 0.0 && !joint.at.is_empty())
            .map(|joint| SpringDamper { at: joint.at.clone(), stiffness: joint.closed, damping: 0.0 })
            .collect();
        let moving = || joints.iter().filter(|joint| !joint.at.is_empty());
        let held: Vec<SpringDamper> = moving().filter_map(StuckAxis::stuck_link).collect();
        let dampers: Vec<SpringDamper> = moving().filter_map(StuckAxis::free_link).collect();
        let dampers: Vec<&SpringDamper> = dampers.iter().collect();
        let rigid: Vec<&[(usize, f64)]> = joints
            .iter()
            .filter(|joint| matches!(joint.state, StuckState::Rigid { .. }) && !joint.at.is_empty())
            .map(|joint| joint.at.as_slice())
            .collect();
        if self.substructure.is_some() || self.moves_bodies() {
            let free = LinearStructure::of_matrices(system.structure().full(), &dampers, &[]);
            let stuck = |held: &[&SpringDamper]| LinearStructure::of_matrices(system.structure().full(), held, &rigid);
            let (stuck, closed) = with_faces(&held, &faces, &stuck);
            return Survey { free, stuck, closed, at_rest, system: system.clone(), joints, loose, unpressed };
        }
        let ends = relative_displacement(system);
        let springs: Vec<SpringDamper> = self
            .springs
            .iter()
            .map(|s| SpringDamper { at: ends(&s.between), stiffness: s.stiffness, damping: s.damping })
            .filter(|link| !link.at.is_empty())
            .collect();
        let mass: Vec<f64> = (0..system.dofs()).map(|i| system.structure().diagonal_mass(i)).collect();
        let free = LinearStructure::new(&mass, &springs.iter().chain(dampers).collect::<Vec<_>>(), &[]);
        let stuck = |held: &[&SpringDamper]| {
            let all: Vec<&SpringDamper> = springs.iter().chain(held.iter().copied()).collect();
            LinearStructure::new(&mass, &all, &rigid)
        };
        let (stuck, closed) = with_faces(&held, &faces, &stuck);
        Survey { system: system.clone(), joints, free, stuck, closed, at_rest, loose, unpressed }
    }
}

/// Returns the displacement between two places as a sum of degrees of freedom. The ground does not
/// move.
fn relative_displacement(system: &System) -> impl Fn(&[String; 2]) -> Vec<(usize, f64)> {
    let index: HashMap<&str, usize> = system.places().iter().enumerate().map(|(i, p)| (p.as_str(), i)).collect();
    move |between| {
        let ends = between.iter().zip([1.0, -1.0]);
        let rows = ends.filter_map(|(name, sign)| Some((system.place_axes()[*index.get(name.as_str())?].rows(), sign)));
        rows.flat_map(|(rows, sign)| rows.iter().map(move |(row, weight)| (*row, sign * weight))).collect()
    }
}

/// Returns the linear structure with the joints of the stuck state, and the structure with
/// closed faces if some faces are apart.
fn with_faces(
    held: &[SpringDamper],
    faces: &[SpringDamper],
    linear: &dyn Fn(&[&SpringDamper]) -> LinearStructure,
) -> (LinearStructure, Option<LinearStructure>) {
    let at_rest: Vec<&SpringDamper> = held.iter().collect();
    let closed: Vec<&SpringDamper> = held.iter().chain(faces).collect();
    (linear(&at_rest), (!faces.is_empty()).then(|| linear(&closed)))
}

impl Survey {
    /// Returns the number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.system.dofs()
    }

    /// Returns the assembled model.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Returns whether the model has too many degrees of freedom for its modes. All modes then
    /// count as unresolved.
    pub fn is_too_large(&self) -> bool {
        self.dofs() > MAX_DOFS
    }

    /// Returns the modes with all joints free.
    pub fn free(&self) -> &LinearModes {
        &self.free.modes
    }

    /// Returns the modes with all joints stuck. All faces are closed, including those that are
    /// apart in static equilibrium.
    pub fn stuck(&self) -> &LinearModes {
        &self.closed.as_ref().unwrap_or(&self.stuck).modes
    }

    /// Returns the bodies that no spring holds.
    pub fn loose(&self) -> &[LooseBody] {
        &self.loose
    }

    /// Returns preloaded contacts that carry no force in static equilibrium, if a body is
    /// loose. No constant force balances their preload.
    pub fn unpressed(&self) -> Option<&UnloadedContacts> {
        self.unpressed.as_ref()
    }

    /// Returns the onset of slip of each joint, in the order of the model.
    pub fn first_slip(&self) -> Vec<FirstSlip> {
        let rigid = self.joints.iter().any(|joint| matches!(joint.state, StuckState::Rigid { .. }));
        let constant = self.system.constant_forces();
        let one = |(joint, carried): (&StuckAxis, &Option<f64>)| {
            let (limit, displacement) = match joint.state {
                StuckState::Nothing => (0.0, None),
                StuckState::Spring { limit, displacement, .. } => (limit, Some(displacement)),
                StuckState::Rigid { limit } => (limit, None),
            };
            FirstSlip {
                joint: joint.name.clone(),
                limit,
                displacement,
                gradual: joint.gradual,
                preload: joint.pressed,
                equilibrium_force: carried.filter(|_| !rigid),
                constant_force: joint.at.iter().map(|&(row, weight)| weight * constant[row]).sum(),
            }
        };
        self.joints.iter().zip(&self.at_rest).map(one).collect()
    }
}
