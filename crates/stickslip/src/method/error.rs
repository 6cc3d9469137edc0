//! Why a method cannot take a system.

use super::Ways;
use crate::model::{System, SystemJoint};
use crate::structure::MOST_IN_FULL;

/// A method cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MethodError {
    /// A law lacks the view that the method needs.
    #[error("{method} cannot take the law `{law}` of joint `{joint}`: {misses}{}", .ways.behind())]
    Law {
        /// The method.
        method: &'static str,
        /// The joint.
        joint: String,
        /// Its law.
        law: &'static str,
        /// What the method misses in it.
        misses: &'static str,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A place has no mass.
    #[error("{method} needs a mass above zero at `{place}` (the law `jenkins` stands for a spring, a massless place and a slider){}", .ways.behind())]
    NeedsMass {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A place that has nothing but joints.
    #[error(
        "{method} needs a mass, a spring or a damper at `{place}`: nothing else says how it moves between its joints; of joints in series make one, as \
         of two `jenkins`, which have the smaller limit and the springs of both in series{}", .ways.behind()
    )]
    Empty {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A place so light between rigid joints that its inertia is lost.
    #[error(
        "{method} loses the inertia of `{place}`, which is {ratio:.0e} times lighter than what it rubs on at joint `{joint}` and rubs on something else, \
         too: of rigid joints in series the weaker one slips, so leave the other and the place out, or give it {least:.0e} of that mass{}", .ways.behind()
    )]
    Light {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// The joint.
        joint: String,
        /// The other mass by its own.
        ratio: f64,
        /// The share of the other mass that is enough.
        least: f64,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// More degrees of freedom than the method's full matrices may have.
    #[error("{method} carries full matrices over at most {most} places, and there are {dofs}{}", .ways.behind())]
    TooLarge {
        /// The method.
        method: &'static str,
        /// Degrees of freedom of the system.
        dofs: usize,
        /// Most that the method takes.
        most: usize,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A matrix is not positive definite.
    #[error("{method} needs a positive definite {matrix} matrix{}", .ways.behind())]
    NotPositive {
        /// The method.
        method: &'static str,
        /// Which matrix.
        matrix: &'static str,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// An option has an impossible value.
    #[error("option `{key}` of {method}: {message}")]
    Option {
        /// The method.
        method: &'static str,
        /// The key.
        key: &'static str,
        /// What is expected.
        message: String,
    },
}

impl MethodError {
    /// `method` misses something in the law of a joint.
    pub fn law(method: &'static str, joint: &SystemJoint, misses: &'static str) -> Self {
        let (joint, law) = (joint.name().to_owned(), joint.law().name());
        MethodError::Law { method, joint, law, misses, ways: Box::default() }
    }

    /// `method` needs a mass where a system has none.
    pub(crate) fn needs_mass(method: &'static str, system: &System, place: usize) -> Self {
        MethodError::NeedsMass { method, place: system.structure().places()[place].clone(), ways: Box::default() }
    }

    /// `method` needs anything but joints at a place: whether a system has one without.
    pub(crate) fn empty(method: &'static str, system: &System) -> Option<Self> {
        let mut empty: Vec<bool> = (0..system.dofs()).map(|row| system.structure().own_mass(row) == 0.0).collect();
        if !empty.contains(&true) {
            return None; // what has mass is not looked through
        }
        system.structure().entries().for_each(|(row, _, _)| empty[row] = false);
        let place = system.structure().places()[empty.iter().position(|empty| *empty)?].clone();
        Some(MethodError::Empty { method, place, ways: Box::default() })
    }

    /// `method` carries full matrices: whether those of a system are too large for it.
    pub(crate) fn too_large(method: &'static str, system: &System) -> Option<Self> {
        let (dofs, most) = (system.dofs(), MOST_IN_FULL);
        (dofs > most).then(|| MethodError::TooLarge { method, dofs, most, ways: Box::default() })
    }

    /// `method` needs a positive definite mass matrix.
    pub(crate) fn mass_not_positive(method: &'static str) -> Self {
        MethodError::NotPositive { method, matrix: "mass", ways: Box::default() }
    }

    /// What to use instead; `None` where another value of an option is all that is needed.
    pub fn ways(&self) -> Option<&Ways> {
        match self {
            MethodError::Law { ways, .. }
            | MethodError::NeedsMass { ways, .. }
            | MethodError::Empty { ways, .. }
            | MethodError::Light { ways, .. }
            | MethodError::TooLarge { ways, .. }
            | MethodError::NotPositive { ways, .. } => Some(&**ways),
            MethodError::Option { .. } => None,
        }
    }

    /// The same refusal, without what to use instead.
    #[must_use]
    pub fn alone(self) -> MethodError {
        self.with(Ways::default())
    }

    /// The same refusal, with what to use instead.
    #[must_use]
    pub fn with(mut self, instead: Ways) -> MethodError {
        match &mut self {
            MethodError::Law { ways, .. }
            | MethodError::NeedsMass { ways, .. }
            | MethodError::Empty { ways, .. }
            | MethodError::Light { ways, .. }
            | MethodError::TooLarge { ways, .. }
            | MethodError::NotPositive { ways, .. } => {
                **ways = instead;
            }
            MethodError::Option { .. } => {}
        }
        self
    }
}
